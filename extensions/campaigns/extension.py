"""The declaration of the extension `campaigns`."""

from quadrotor.extension import (
    Command,
    Evidence,
    Extension,
    Function,
    Group,
    Judged,
    PageFeature,
    PagePanel,
)

EXTENSION = Extension(
    name="campaigns",
    summary="Many flights by a plan, on one computer or several, and back to each of them",
    protocol=1,
    offers=(
        Function(name="campaign", target=".notebook:campaign"),
        PageFeature(name="campaigns", target=".routes:FEATURE"),
        PageFeature(name="trends", target=".routes:TRENDS"),
        PagePanel(
            name="trends",
            target="page/trends.js:show",
            place="runs",
            title="Trends",
            styles=("trends.css",),
        ),
        PagePanel(
            name="campaigns",
            target="page/campaigns.js:show",
            place="experiments",
            title="Campaigns",
            styles=("campaigns.css",),
        ),
        Command(
            name="campaign",
            target=".command:CampaignCommand",
            group=Group.FLY,
            summary="Fly an experiment many times by a plan, on one computer or several, and judge "
            "the rows.",
            examples={
                "quadlab campaign new": "write a plan to start from",
                "quadlab campaign run plan.toml --out gains": "fly it, or the rest of it",
                "quadlab campaign show gains": "print the figures, and how to fly failed rows",
            },
        ),
        Command(
            name="campaign new",
            target=".actions:New",
            summary="Write a plan with comments to start from, and its schema for editors.",
        ),
        Command(
            name="campaign check",
            target=".actions:Check",
            summary="Check each row of a plan, and print what it flies and how long that may take.",
        ),
        Command(
            name="campaign run",
            target=".actions:Run",
            summary="Fly a plan, or the rest of it if the folder has some of its rows.",
        ),
        Command(
            name="campaign resume",
            target=".actions:Resume",
            summary="Fly the rest of a campaign that was stopped.",
        ),
        Command(
            name="campaign merge",
            target=".actions:Merge",
            summary="Join the shards of a campaign into the first folder: one table, in the order "
            "of the index.",
        ),
        Command(
            name="campaign show",
            target=".actions:Show",
            summary="Print shares and quantiles of a campaign, and the command that flies each "
            "failed row.",
        ),
        Command(
            name="campaign compare",
            target=".actions:Compare",
            summary="Compare two campaigns flight by flight, paired by seed and factors.",
        ),
    ),
    judged=(Judged(Evidence.SIMULATED, "campaigns with workers killed at random"),),
    libraries=dict.fromkeys(("distributed", "optuna", "SALib"), "pip install 'quadlab[campaigns]'"),
    docs="how_to/campaigns.md",
)
