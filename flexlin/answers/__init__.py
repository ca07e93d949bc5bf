"""Answers to an engineer's questions: each takes a scene and returns numbers with their errors."""
