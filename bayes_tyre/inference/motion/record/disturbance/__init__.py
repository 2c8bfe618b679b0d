"""What acts on the axle at random: the road's roughness, and the force that load and law leave out."""
