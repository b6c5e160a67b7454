"""Proofs of the article's errors, by computer algebra."""
