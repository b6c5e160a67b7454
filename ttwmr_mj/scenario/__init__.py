"""Scenarios: schema, files, faults."""
