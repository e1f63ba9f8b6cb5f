// SPDX-License-Identifier: GPL-3.0-or-later
// A batch of the extension as a job type of Flamenco, a part a task. It has not been run: it follows Flamenco's
// documentation of job types. Put it into the Manager's folder `scripts`.
// The same job again does what is left of a killed one.

const JOB_TYPE = {
  label: "ARAP Fields batch",
  settings: [
    { key: "program", type: "string", default: "blender", required: true,
      description: "Blender, as the workers start it" },
    { key: "input", type: "string", required: true, subtype: "dir_path",
      description: "The folder of meshes or .blend files" },
    { key: "output", type: "string", required: true, subtype: "dir_path",
      description: "The folder of the results, shared by all workers" },
    { key: "flags", type: "string", default: "--style cube",
      description: "Flags of batch but --shard and --again, separated by blanks" },
    { key: "parts", type: "int32", default: 4, required: true, description: "Into how many tasks" },
  ],
};

function compileJob(job) {
  const settings = job.settings;
  const flags = settings.flags.split(/\s+/).filter((word) => word.length > 0);
  for (let part = 1; part <= settings.parts; part++) {
    const task = author.Task("part-" + part, "misc");
    task.addCommand(author.Command("exec", {
      exe: settings.program,
      args: ["--command", "arapfields", "batch", "-i", settings.input, "-o", settings.output]
        .concat(flags, ["--shard", part + "/" + settings.parts]),
    }));
    job.addTask(task);
  }
}
