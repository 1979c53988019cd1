"""What a fit may be believed: alarms, closure, look-alikes, stability and the causes that are
named.
"""
