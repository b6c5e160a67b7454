"""All claims, in the order of the article."""

from __future__ import annotations

from ttwmr_mj.studies.reproduce.claims.correction import CORRECTION_CLAIMS
from ttwmr_mj.studies.reproduce.claims.experiment import EXPERIMENT_CLAIMS
from ttwmr_mj.studies.reproduce.claims.judging import Claim
from ttwmr_mj.studies.reproduce.claims.theorems import THEOREM_CLAIMS
from ttwmr_mj.studies.reproduce.claims.tracking import TRACKING_CLAIMS

CLAIMS: dict[str, Claim] = {
    claim.name: claim
    for claim in (*THEOREM_CLAIMS, *CORRECTION_CLAIMS, *TRACKING_CLAIMS, *EXPERIMENT_CLAIMS)
}
