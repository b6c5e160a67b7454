"""What the results of a sweep say: statistics, figures and report.html."""
