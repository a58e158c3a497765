"""`quadlab.campaign`: the rows of a campaign for notebooks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from extensions.campaigns.folder import CampaignFolder

if TYPE_CHECKING:
    import pyarrow as pa


def campaign(folder: str | Path) -> pa.Table:
    """Return the rows of a campaign as an Arrow table, a row for each flight that has ended.

    `campaign("DIR").to_pandas()` and `polars.from_arrow(campaign("DIR"))` are data frames.

    Raises StorageError for a folder without a campaign, or without rows.
    """
    return CampaignFolder(Path(folder).expanduser()).table()
