"""Navigation: attitude and position of a body from gyros, accelerometers and satellite fixes."""
