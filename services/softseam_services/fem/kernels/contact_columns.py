"""What is in the rows of contact (kernels/contact.py): states and sides of candidates, kinds of points, columns."""

OPEN, STICK, SLIP = 0, 1, 2
TO_HOLD, HELD = 3, 4
"""before an evaluation: what stuck in the last step shall stick once more; after it: it does, beyond its bound, or
pulled by its tool"""
AT_NODE, ALONE, SPREAD = -1, -2, -3
"""in model.point_face: a node of a face that has points of its own; a point that touches every tool; and one of the
many of an embedded surface, which touches every tool, too, and keeps a gap: body/contact_points.py"""
SWEPT, EDGED = -2, -3
"""in work.side: the point meets work.plane; its patch is looked at in parts, for the tool has edges"""
# columns of work.contact
GAP, PRESSURE, NORMAL, TRACTION, TRIAL, SLIDE, RELAXED, SLOPE = 0, 1, 2, 5, 8, 9, 12, 13
N_COLUMNS = 14
# columns of a contact state (p, t, 9): force on the body [N], slip since contact began [m], anchor [m]
FORCE, SLIP_SO_FAR, ANCHOR = 0, 3, 6
N_STATE = 9
