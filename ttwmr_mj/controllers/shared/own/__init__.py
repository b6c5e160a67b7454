"""Laws of the user's: where their modules are, what they say as text, and their import."""
