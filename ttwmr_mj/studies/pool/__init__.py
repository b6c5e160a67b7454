"""Many runs in processes, and when a finished one may be used again."""
