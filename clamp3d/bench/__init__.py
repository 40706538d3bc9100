"""Experiments on the methods: comparison, stress, the paper's tables, image measurement."""
