"""Sweeps: thousands of runs that differ in numbers, kept in files that survive anything."""
