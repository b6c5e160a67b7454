"""The robot in MuJoCo: XML and parameters made into one MjModel."""
