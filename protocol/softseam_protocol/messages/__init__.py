"""Every message of softseam, declared once.

Each message is a frozen dataclass. `codec` derives its protobuf form from the annotations: a field's number is
its place in the class plus one (number 1 names the message), so fields are only ever appended. Arrays are validated
tensors: `Array("f8", None, 3)` is a float64 array of shape (n, 3) for any n.
"""
