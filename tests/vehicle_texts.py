"""Texts of vehicle files, sound ones, that tests put mistakes into."""

BODY = """
schema = 1
name = "body"
kind = "submerged-body"
dof = ["sway", "roll", "yaw"]
[body]
mass = 50.0
inertia = [1.0, 9.0, 9.0]
speed = 1.5
[coefficients]
Y_vdot = -40.0
Y_v = { value = -60.0, bounds = [-100.0, 0.0] }
N_delta_r = -12.0
[inputs]
rudder = "delta_r"
[outputs.r]
sigma = 0.003
[[effects]]
effect = "quadratic-damping"
equation = "sway"
parameters = { Y_vv = -3.0 }
[[effects]]
effect = "actuator-lag"
actuator = "rudder"
[[effects]]
effect = "sensor-bias"
channel = "r"
"""
RIG = """
schema = 1
name = "rig"
kind = "mechanism"
dof = ["x", "y"]
coefficients = { I_x = 2, I_y = 1, K_x = 3, B_x_motor = 1 }
inputs = { motor = "u" }
outputs.x_rate.sigma = 0.1
effects = [{ effect = "coulomb-friction", equation = "x", smoothing = 0.1 }]
"""
