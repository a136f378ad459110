"""Why answers fail: the mistakes that give them, several at once where there are several.

A mistake in an equation changes its terms, and the answers to M a - F = 0 are linear in such changes. `terms` evaluates
equations that are written as sums of products, `dictionary` has them and what people write in their place, `regression`
finds the fewest changes that give the answers, and `levels` applies it to what is asked at levels 1 to 5. `relations`
are what answers are instead of right ones. `statement` asks these in turn, and says what follows from what.
"""

from tippedisk_verify.conformance.diagnosis.statement import Diagnosis, diagnosed

__all__ = ["Diagnosis", "diagnosed"]
