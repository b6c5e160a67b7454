"""The article's figures, drawn again."""
