"""One file a coupling loop that the product does without; `analysis.rows` names them."""
