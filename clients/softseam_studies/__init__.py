"""What is done with many runs of softseam: charts, plans, atlas, fits, surrogates and policies.

It stands on `softseam`, which knows it by the table of `softseam.commands` alone.
"""
