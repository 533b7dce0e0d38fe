"""The paper's claims: which jobs answer them, the rules that judge, and an audit of the labels."""
