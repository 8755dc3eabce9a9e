"""The motion that answers the question: excitation within a robot's limits.

`design_motion` finds the motion whose record determines the parameters best, and says before the
robot moves how large their standard errors will be.
"""
