"""The parameters of Equation 2 as least squares orders them."""

#: The order of the parameters in every vector: kN/mm, kN, mm, mm, kN.
PARAMETERS = ("k", "C", "beta", "d_i", "F_i")
K, C, BETA, D_I, F_I = range(5)
