"""Generation: a language model writes plans, and what it writes is checked.

``language_model`` says what a model is, ``providers`` talk to real ones, ``prompts`` says what they
are asked, ``loop`` asks until a plan is accepted. What is accepted is not decided here: the loop is
given a judge.
"""
