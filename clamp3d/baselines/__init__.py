"""Interchangeable contact models: how a pair of parts is measured."""
