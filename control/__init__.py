"""Control from a reference to motor commands: eqs. 4, 5 and the saturation rule of Sec. 4.

`position_law` (eq. 4) gives a force, `desired_attitude` an attitude that points along it,
`attitude_law` (eq. 5) torques, `allocation` feasible thrusts; `controller` combines them in this
order. `trajectories` fill a reference from a time, `behaviors` decide which trajectory is flown.
"""
