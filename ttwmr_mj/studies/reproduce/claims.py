"""All claims, in the order of the article."""

from __future__ import annotations

from ttwmr_mj.studies.reproduce.claims_correction import CORRECTION_CLAIMS
from ttwmr_mj.studies.reproduce.claims_experiment import EXPERIMENT_CLAIMS
from ttwmr_mj.studies.reproduce.claims_theorems import THEOREM_CLAIMS
from ttwmr_mj.studies.reproduce.claims_tracking import TRACKING_CLAIMS
from ttwmr_mj.studies.reproduce.judging import Claim

CLAIMS: dict[str, Claim] = {
    claim.name: claim
    for claim in (*THEOREM_CLAIMS, *CORRECTION_CLAIMS, *TRACKING_CLAIMS, *EXPERIMENT_CLAIMS)
}
