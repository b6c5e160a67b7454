"""The look that all HTML reports share: one template, one style, figures inside of the page."""
