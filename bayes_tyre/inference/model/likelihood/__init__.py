"""The forces of records given their parameters: point by point, compressed, and with F_i and J integrated out."""
