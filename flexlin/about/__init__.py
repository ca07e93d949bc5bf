"""The bridge: a manipulator about its motion, symbolically and as the linear system that the numeric wing takes."""
