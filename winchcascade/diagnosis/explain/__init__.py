"""What a diagnosis means: where the gap lies, what each cause costs, how well the model is
validated, what to test next.
"""
