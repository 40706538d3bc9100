"""Drawings of contacts, sections, states and steps, as matplotlib figures."""

from clamp3d.output.assembly_figures import exploded_figure, steps_figure
from clamp3d.output.figures import contact_figure, contacts_figure, save_figure, section_figure, states_figure

__all__ = [
    "contact_figure",
    "contacts_figure",
    "exploded_figure",
    "save_figure",
    "section_figure",
    "states_figure",
    "steps_figure",
]
