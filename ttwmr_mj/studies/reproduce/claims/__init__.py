"""The article's claims and how each is judged."""
