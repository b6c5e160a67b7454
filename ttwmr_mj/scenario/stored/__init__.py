"""Runs read back from their folders."""
