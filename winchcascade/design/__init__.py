"""What the corrected rig says about other loads, speeds and motions, and which runs would make
it better known.
"""
