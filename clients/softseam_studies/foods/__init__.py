"""`softseam materials`: foods that a scene may name."""
