# Costmaps, navigation, DWA, E-band.
