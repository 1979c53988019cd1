"""The rig as a physics model: winch, restoring module, drivetrain, generator, bridge, DC link
and sensors.
"""
