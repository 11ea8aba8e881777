"""`softseam fit`: what a body is made of, from the force that was measured on a tool."""
