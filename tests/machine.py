"""How much slower than the machine of its figures another one may be that runs these tests.

What a limit in seconds is there to find, work that grows with the square of a file, costs ten times
as much and more.
"""

SLOWER = 3.0
