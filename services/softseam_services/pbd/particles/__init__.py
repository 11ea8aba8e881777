"""PBD on particles: sheets and ropes in scenes, and constraints on tetrahedra; classic stiffnesses or compliances."""
