"""What every package uses: runs, units, files of rig, campaign and published table, errors,
output files and numerics.
"""
