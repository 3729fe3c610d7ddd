# TEB and MPPI.
