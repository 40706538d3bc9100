"""Families of hard cases with known answers, put to every contact method."""
