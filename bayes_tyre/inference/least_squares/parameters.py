"""Names and order of the parameters of Equation 2 in the vectors of least squares."""

#: The order of the parameters in every vector: kN/mm, kN, mm, mm, kN.
PARAMETERS = ("k", "C", "beta", "d_i", "F_i")
K, C, BETA, D_I, F_I = range(5)
