"""Contact models: interchangeable ways to measure a groove against a cylinder, made by `contact_model`."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
