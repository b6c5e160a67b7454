"""Models of the article: kinematic (Eq. 1-10), kinetic (11-23), hybrid (24-29)."""
