"""Dynamic zoning: the pure algorithms of Keith & La (SA, GA, DDZ), after Ho & Liao.

roads       critical points and distances of a floor      designs     zone designs as data
paths       feasible paths, union paths                   tips        tip workstations
exchange    removing and giving a tip                     transfer    transfer stations
load        eq. 1-4, balance                              annealing   simulated annealing
genetic     the genetic algorithm                         consensus   eq. 5 and Algorithm 3
negotiation Algorithm 4                                   routing     who takes a part, and where to
seeding     first designs
picture     a design drawn over its floor                 space       scratch, rules
"""
