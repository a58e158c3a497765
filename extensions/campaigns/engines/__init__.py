"""The engines that fly the tasks of a campaign: processes of this computer, or workers of Dask."""
