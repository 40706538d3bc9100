"""``python -m clamp3d``."""

from clamp3d.cli import main

if __name__ == "__main__":
    main()
