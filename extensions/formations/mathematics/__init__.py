"""The mathematics of formations by bearings, and of paths along which bearings tell most.

World w has z up. The yaw frame y of a vehicle has its origin at the vehicle and z up, and is turned
by the vehicle's yaw psi: roll and pitch are taken out of each bearing before it comes here. An edge
k = (i, j) is directed: vehicle i measures the unit vector to vehicle j in its own yaw frame,

    beta_ij = Rz(psi_i)^T g_ij,     g_ij = (p_j - p_i) / d_ij,     d_ij = |p_j - p_i|.
"""
