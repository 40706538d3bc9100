"""Hard poses of a wire in a groove."""
