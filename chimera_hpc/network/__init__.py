"""Networks: nodes, oriented links, and the matrices of their incidence."""
