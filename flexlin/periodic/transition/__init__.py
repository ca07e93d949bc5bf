"""Transition matrices over the segments of a period by Gauss or Radau collocation, and how many segments there are."""
