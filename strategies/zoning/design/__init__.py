"""Zone designs and how they are judged (Keith & La, after Ho & Liao): pure algorithms on arrays.

zone_paths         feasible paths, union paths       tip_stations        tip workstations
exchange           giving a tip to another zone      transfer_stations   where loads change zones
zone_load          eq. 1-4, balance                  zone_work           the same of what lies in queues
part_routing       who takes a part, and where to    first_designs       seeds, random designs
zone_capabilities  what robots of types can do       zone_cells          cells of segments
design_files       designs as data                   design_picture      a design over its floor
service_zone_lines zones as text                     zone_workspace      scratch, rules
portable_math      exp and ln                        zoning_draws        random draws
"""
