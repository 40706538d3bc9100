"""``python -m clamp3d``."""

from clamp3d.cli import program

if __name__ == "__main__":
    program()
