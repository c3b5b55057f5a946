"""Settings of the study."""

from typing import Annotated, Literal

from pydantic import Field

from snakebench.studies.training_jobs import LearningConfig


class TeacherStudentConfig(LearningConfig):
    """Settings of the teacher-student study."""

    method: Literal["teacher_student"] = "teacher_student"
    viscosities: Annotated[int, Field(ge=2, le=10_000)] = Field(11, description="evaluated between 1e-7 and 1e-2 m^2/s")
