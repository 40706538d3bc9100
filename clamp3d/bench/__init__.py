"""Experiments on the methods: charts, complexity, stability, image measurement."""
