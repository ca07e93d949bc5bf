"""The smallest change of uncertain numbers that makes a loop unstable."""
