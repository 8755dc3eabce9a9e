"""The room that a robot takes and the room that it has: bodies, obstacles, and their distances.

Capsules stand for the links, from the collision elements of a URDF or given by hand;
`Clearances` are the distances between them and what they must not touch, with their gradients.
"""
