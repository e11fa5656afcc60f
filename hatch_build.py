"""Build hook: compile schemas/**/*.proto into the one descriptor set that the wheel ships."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parent
OUTPUT = ROOT / "roadlog" / "schemas.binpb"


def compile_schemas(output: Path = OUTPUT) -> Path:
    """Write the FileDescriptorSet of every schema, with imports and comments, to `output`."""
    import grpc_tools
    from grpc_tools import protoc

    sources = sorted(str(path) for path in (ROOT / "schemas").rglob("*.proto"))
    well_known = Path(grpc_tools.__file__).parent / "_proto"
    arguments = ["protoc", f"-I{ROOT / 'schemas'}", f"-I{well_known}", "--include_imports"]
    arguments += ["--include_source_info", f"--descriptor_set_out={output}", *sources]
    if protoc.main(arguments) != 0:
        raise RuntimeError("protoc could not compile schemas/; its messages are above")
    return output


try:
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface
except ModuleNotFoundError:  # run as a script, without the build backend
    pass
else:

    class SchemaBuildHook(BuildHookInterface):
        """Runs for wheels and for editable installs alike."""

        def initialize(self, version: str, build_data: dict) -> None:  # noqa: ARG002
            compile_schemas()


if __name__ == "__main__":
    print(compile_schemas())
