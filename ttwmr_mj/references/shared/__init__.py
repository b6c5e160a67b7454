"""What several references share."""
