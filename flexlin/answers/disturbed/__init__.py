"""What a disturbance does to a loop: stated in words, answered by the linear and by the nonlinear equations."""
