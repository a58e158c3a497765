"""The declaration of the extension `fmu`."""

from quadrotor.extension import Command, Evidence, Extension, Group, Judged, PluginFormat

EXTENSION = Extension(
    name="fmu",
    summary="Laws and estimators from FMUs, and our plant and law as FMUs, for FMI 2 and 3",
    protocol=1,
    offers=(
        Command(
            name="export",
            group=Group.SET_UP,
            summary="Write the simulated plant or the geometric law as an FMU, for Simulink and "
            "Modelica tools.",
            target=".command:Export",
            examples={
                "quadlab export fmu plant --out plant.fmu": "write the simulated vehicle as an FMU",
                "quadlab export fmu law --out mine.fmu --set control.preset=stiff": "… or the law",
            },
        ),
        PluginFormat(name=".fmu", target=".plugin:FORMAT", plugins=("law", "estimator")),
    ),
    judged=(Judged(Evidence.PEER, "FMUs of pythonfmu3, and ours in fmpy"),),
    libraries={"fmpy": "`scripts/setup fmu` or `pip install 'quadlab[fmu]'`"},
    docs="extending/fmu_export.md",
)
